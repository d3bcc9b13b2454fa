"""``python -m core.report``: runs in, tables, figures and a page out."""
