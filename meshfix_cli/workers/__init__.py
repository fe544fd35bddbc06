"""Who does the work: processes of this machine, of `mpiexec`, or of a Dask cluster."""
