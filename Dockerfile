# mcpseg for processors: docker build -t mcpseg . && docker run mcpseg
# Your own scans: docker run -v "$PWD:/data" mcpseg mcpseg segment /data/scans /data/poses.csv -o /data/out
FROM python:3.12-slim

# what Open3D and numba load from the system
RUN apt-get update \
    && apt-get install --yes --no-install-recommends libgl1 libgomp1 libx11-6 libusb-1.0-0 \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /mcpseg
COPY . .
RUN pip install --no-cache-dir --extra-index-url https://download.pytorch.org/whl/cpu '.[plot]'

CMD ["sh", "-c", "mcpseg segment examples/office_walk/scans examples/office_walk/poses.csv -o out/demo && mcpseg eval out/demo examples/office_walk/gt && mcpseg export out/demo -o out/demo.html -o out/demo.png"]
