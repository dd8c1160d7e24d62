"""One mechanism a file: its constraints, their derivatives, its frame convention."""
