"""What the steps of a run work with: devices under guards, the controller's config, the run folder."""
