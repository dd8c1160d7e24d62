"""A run of a cell: put together, executed, resumed, replayed."""
