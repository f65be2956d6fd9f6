"""A prism, whose cross-section is the same everywhere along x, under loads that roll over it.

x points along the prism, the load moves along +x; y points up and z across, x, y, z right-handed.
Stations lie downstream of the first one, ``x_c = x_0 - c h``. Elastic fields are sums of waves
along x; each wavenumber is a problem of the cross-section alone, factorised once. A steady pass is
found by `solver.rolling.passing.passing` on a `PrismTrack`.
"""
