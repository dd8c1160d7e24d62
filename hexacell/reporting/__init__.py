"""What is found of a result, and the documents that say it to programs."""
