"""Where mathematics, procedures and drivers come together for the faces."""
