"""A result and the controller's config: applied by a person, recorded, rolled back."""
