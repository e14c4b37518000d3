FROM debian:trixie-slim
COPY packages.txt /tmp/packages.txt
RUN apt-get update \
    && sed 's/#.*//' /tmp/packages.txt | xargs apt-get install -y --no-install-recommends \
    && rm -rf /var/lib/apt/lists/*
COPY . /opt/elastune
ENV PATH=/opt/elastune:$PATH
WORKDIR /work
ENTRYPOINT ["/opt/elastune/run"]
CMD ["elastune", "--help"]
