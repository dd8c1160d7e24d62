"""What is to be identified from what: records, commanded poses, prior and noise, checked."""
