# The command `vto` with all that it needs: make image, then
# docker run --rm -v "$PWD:/work" vto-pipeline run configs/demo.yaml -o runs/demo
FROM python:3.11-slim-bookworm

RUN apt-get update && apt-get install -y --no-install-recommends \
        libegl1 libgl1 libgomp1 libidn2-0 libudev1 libusb-1.0-0 libx11-6 \
    && rm -rf /var/lib/apt/lists/*

COPY pyproject.toml README.md LICENSE /source/
COPY vto_pipeline /source/vto_pipeline
RUN pip install --no-cache-dir "/source[batch]" && rm -rf /source

# Compiled kernels go to the home of a user without rights; what is given and made lies under /work.
RUN useradd --create-home vto
USER vto
WORKDIR /work
ENTRYPOINT ["vto"]
CMD ["--help"]
