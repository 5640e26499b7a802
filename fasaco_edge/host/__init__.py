"""This computer: files and folders, processes and memory, what comes with the package."""
