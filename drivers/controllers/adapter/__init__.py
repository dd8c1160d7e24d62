"""A controller behind a program of any language, by lines of JSON (docs/controller-adapter.md)."""
