"""The fit of a geometry: model, iteration, tests of the residuals, result; begin with :mod:`.fit`."""
