"""CPU time against error: ``python -m tests.benchmarks [--quick] [--out DIR]``.

Measured is the CPU time of this process (system and path set up, walked, sampled) on one thread,
the median of several runs where a run is short. Excluded are importing the packages, compiling
(one run ahead of all others warms up), writing files and whatever a study adds. Only ratios within
one run of the benchmark mean anything.
"""
