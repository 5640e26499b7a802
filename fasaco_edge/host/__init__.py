"""Host computer: files and folders, processes and memory, data files of the package."""
