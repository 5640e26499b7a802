"""Parts of the command ``plan``: options, request, results."""
