# docker build -t meshfix . && docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/data" meshfix untangle in.vtk out.vtk
FROM python:3.13-slim AS build
# hadolint ignore=DL3008
RUN apt-get update && apt-get install -y --no-install-recommends g++ && rm -rf /var/lib/apt/lists/*
COPY . /source
RUN python -m venv /meshfix && /meshfix/bin/python -m pip install --no-cache-dir "/source[hdf5]"

FROM python:3.13-slim
COPY --from=build /meshfix /meshfix
USER 1000:1000
WORKDIR /data
ENTRYPOINT ["/meshfix/bin/meshfix"]
