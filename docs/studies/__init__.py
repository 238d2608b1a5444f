"""The studies behind docs/identification.md.

``fractional``, ``preisach``, ``speed``, ``recovery``, ``noise`` and ``measured`` fit and run, and turn the results into
metrics beside the thesis' values or this project's targets. ``compute`` runs all of them once; the chapters turn their
results into text and pictures, which ``page`` writes.
"""
