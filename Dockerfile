FROM python:3.11-slim

# meshio, h5py and the solvers come as wheels: no compiler is needed.
ENV PIP_NO_CACHE_DIR=1 \
    PYTHONUNBUFFERED=1 \
    OMP_NUM_THREADS=1 \
    MKL_NUM_THREADS=1 \
    NUMBA_CACHE_DIR=/tmp/numba \
    MPLCONFIGDIR=/tmp/matplotlib

WORKDIR /app
COPY pyproject.toml setup.py constraints.txt README.md LICENSE ./
COPY solver solver
COPY studies studies
COPY service service
COPY data data
RUN if [ "$(uname -m)" = x86_64 ]; then extra='[mkl]'; else extra=''; fi \
    && pip install --constraint constraints.txt ".$extra"

RUN useradd --create-home --uid 1000 residua && install --directory --owner residua /data
USER residua
WORKDIR /home/residua
VOLUME /data
EXPOSE 8000

HEALTHCHECK --interval=15s --timeout=5s --start-period=60s --retries=3 \
    CMD ["python", "-c", "import urllib.request as u; u.urlopen('http://127.0.0.1:8000/health', timeout=4)"]

CMD ["residua", "serve", "--host", "0.0.0.0", "--port", "8000", "--data", "/data"]
