# The tag says what it is, the digest which one: the same image for everybody, until the line is
# changed. `docker buildx imagetools inspect python:3.11-slim` shows the digest of today's.
FROM python:3.11-slim@sha256:9c900dea9e8fb7e16277c179b555cc72d29a352dbc33cff48ad5a0412fd5bfc7

# meshio, h5py and the solvers come as wheels: no compiler is needed.
ENV PIP_NO_CACHE_DIR=1 \
    PYTHONUNBUFFERED=1 \
    OMP_NUM_THREADS=1 \
    MKL_NUM_THREADS=1 \
    NUMBA_CACHE_DIR=/tmp/numba \
    MPLCONFIGDIR=/tmp/matplotlib \
    PYTHONSAFEPATH=1 \
    NO_PROXY=127.0.0.1,localhost \
    no_proxy=127.0.0.1,localhost

WORKDIR /app
COPY pyproject.toml requirements.lock mkl.lock README.md LICENSE ./
COPY solver solver
COPY studies studies
COPY service service
COPY residua residua
COPY data data
# Every file that is installed has a digest in a lock (`make lock`). `--build-arg MKL=yes` adds
# Intel's PARDISO, whose licence is not free: docs/howto/operations.md.
ARG MKL=
RUN pip install --require-hashes --requirement requirements.lock ${MKL:+--requirement mkl.lock} \
    && pip install --no-deps --no-build-isolation .
# Compiled kernels, which `watched.py` copies to where a container may write, and digests of sources.
RUN cd / \
    && NUMBA_CACHE_DIR=/app/kernels python -c "import solver.rolling.kernels, solver.fatigue.kernels, solver.fem.kernels" \
    && python -c "from studies.definition.identity import solver_hash; solver_hash()"
COPY docker/watched.py /usr/local/lib/watched.py

RUN useradd --create-home --uid 1000 residua \
    && install --directory --owner residua /data \
    && install --directory --owner residua --mode 700 /certificates /certificates/scheduler \
        /certificates/worker /certificates/service
USER residua
WORKDIR /home/residua
VOLUME /data
EXPOSE 8000

HEALTHCHECK --interval=15s --timeout=5s --start-period=60s --retries=3 \
    CMD ["python", "-c", "import urllib.request as u; u.urlopen('http://127.0.0.1:8000/health', timeout=4)"]

ENTRYPOINT ["python", "/usr/local/lib/watched.py", "http://127.0.0.1:8000/health"]
# Inside a container the address says nothing about who gets in: without a key it does not start.
CMD ["residua", "serve", "--host", "0.0.0.0", "--port", "8000", "--data", "/data"]
