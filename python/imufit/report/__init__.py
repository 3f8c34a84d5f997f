"""One self-contained HTML page from the loop's results: it opens offline and loads nothing."""

from imufit.report.page import page
from imufit.report.pictures import Picture, Pictures, pictures

__all__ = ["Picture", "Pictures", "page", "pictures"]
