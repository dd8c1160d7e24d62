"""Notices of unattended runs: kept on the disk, and sent until each address has them."""
