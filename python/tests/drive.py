"""drive.py SCHEDULER JOB OUT SCANS OPTION...: converts on a cluster; prints how far it is, and the workers left."""

import sys

from distributed import Client

from pointmill.dask import Progress, convert


def tell(state: Progress) -> None:
    print(state.kind, state.units_done, state.units, flush=True)


if __name__ == "__main__":
    scheduler, job, out, scans, *options = sys.argv[1:]
    with Client(scheduler, timeout="60s") as client:
        client.wait_for_workers(3, timeout=60)
        convert(scans, out, job=job, client=client, options=options, memory="1GiB", progress=tell)
        print("workers", len(client.nthreads()), flush=True)
