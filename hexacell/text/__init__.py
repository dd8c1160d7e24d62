"""What users read about events, questions, results and devices: text from typed data, printed nowhere."""
