"""What a cell states of its robot: model, systematic effects, limits of motion, virtual robots."""
