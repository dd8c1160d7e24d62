"""One mechanism a file: constraints, derivatives, frame convention."""
