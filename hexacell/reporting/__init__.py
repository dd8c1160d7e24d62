"""Reports of a result: its assessment, findings in sentences, JSON documents."""
