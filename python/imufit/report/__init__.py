"""One self-contained HTML page from the loop's results: it opens offline and loads nothing."""

from imufit.report.page import page

__all__ = ["page"]
