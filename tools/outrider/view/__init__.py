"""Live view: draws a flight, a run directory or MAVLink links in the browser, and returns view commands.

The data path is: snapshots of a flight → bounded channel → renderer in the browser. View commands return the
same way. ``outrider.scene`` has the picture's data; the flight, ``listener`` and ``player`` produce them;
``renderer`` and ``panel`` draw them with viser. A flight never waits for its view.
"""
