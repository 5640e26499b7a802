"""What has been covered, how far it is, and what stays uncovered."""
