"""Which poses to visit: to learn the most while measuring, and to judge the result afterwards."""
