"""The command line: parses arguments, prints, reads keys; decides and words nothing itself."""
