"""What must hold before a run: stated poses, certificates, security."""
