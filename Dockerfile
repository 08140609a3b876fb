# Sagittal: one image for web and worker. Build: docker build -t sagittal .
# Run: docker run -p 127.0.0.1:8000:8000 -v sagittal:/data -e SAGITTAL_BEHIND_TLS=1 sagittal  (behind a TLS proxy)
FROM python:3.13-slim AS build
WORKDIR /src
COPY pyproject.toml README.md LICENSE requirements.lock requirements-image.lock ./
# every file by its hash (.ci/lock writes the lists)
RUN python -m venv /opt/sagittal && python -m venv /opt/build \
    && /opt/sagittal/bin/pip install --no-cache-dir --require-hashes -r requirements.lock \
    && /opt/build/bin/pip install --no-cache-dir --require-hashes -r requirements-image.lock
COPY core core
COPY sagittal sagittal
COPY server server
COPY web web
COPY migrations migrations
RUN /opt/build/bin/pip wheel --no-deps --no-build-isolation --wheel-dir /opt/wheel . \
    && /opt/sagittal/bin/pip install --no-deps --no-index /opt/wheel/*.whl
# what is in the image, as CycloneDX
RUN /opt/build/bin/cyclonedx-py environment --output-reproducible --pyproject pyproject.toml --output-format JSON \
    --output-file /opt/sagittal/sbom.json /opt/sagittal/bin/python

FROM python:3.13-slim
# Pango lays out the text of PDFs
RUN apt-get update && apt-get install -y --no-install-recommends libpango-1.0-0 libpangoft2-1.0-0 fonts-liberation \
    && rm -rf /var/lib/apt/lists/*
RUN useradd --uid 10001 --create-home --shell /usr/sbin/nologin sagittal \
    && mkdir /data && chown sagittal:sagittal /data
COPY --from=build /opt/sagittal /opt/sagittal
ENV PATH=/opt/sagittal/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    SAGITTAL_HOME=/data \
    SAGITTAL_HOST=0.0.0.0 \
    XDG_CACHE_HOME=/data/cache
USER sagittal
VOLUME ["/data"]
EXPOSE 8000
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=30s --timeout=5s --start-period=60s CMD ["python", "-c", "import urllib.request as u; u.urlopen('http://127.0.0.1:8000/health/live', timeout=4)"]
CMD ["sagittal", "serve"]
