"""A study carried out by processes of this computer or by a Dask cluster."""
