"""Write candidates as rows of a spreadsheet."""

import csv

from core.hooks import hookimpl


class Rows:
    """Writes ``candidates.csv`` into the run's folder."""

    def __init__(self, delimiter: str = ","):
        self.delimiter = delimiter
        self._file = None

    @hookimpl
    def run_started(self, run):
        self._file = (run.folder / "candidates.csv").open("w", newline="")
        self._rows = csv.writer(self._file, delimiter=self.delimiter)
        self._rows.writerow(("candidate", "status", "reward"))

    @hookimpl
    def candidate_evaluated(self, evaluation):
        self._rows.writerow(
            (evaluation.candidate.id, evaluation.status, evaluation.reward)
        )

    @hookimpl
    def run_ended(self):
        if self._file is not None:
            self._file.close()
