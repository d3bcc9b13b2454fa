"""``vlmgineer report``: runs in, tables, figures and a page out."""
