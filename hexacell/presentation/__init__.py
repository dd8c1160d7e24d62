"""What is said to people about events, results and devices, for every face."""
