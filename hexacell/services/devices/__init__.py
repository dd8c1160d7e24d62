"""The devices of a cell: set up, searched, diagnosed; a first cell file from them."""
