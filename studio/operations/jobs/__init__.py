"""The tracking process, its commands and events; jobs in the background; executors of trials.

Work beside the tracking process is a job of one `JobRunner` (`job_runner.py`): queued, running, cancelling, done,
failed or cancelled, in Python, in JSON and on the page. Its state is one value, sent as an event; `/api/jobs` lists
all of them, by which a page that was loaded again finds its own. What a job gives to processes goes through an
executor of the shape of `concurrent.futures` (`process_executor.py` here, `cluster.py` on the workers of a Dask
scheduler). A command to the tracking process names its run: opening it, waiting for its turn and starting are decided
there, in one step.
"""
