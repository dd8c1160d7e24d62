"""The controller's config: its formats, a proposed change, the write-back and its rollback."""
