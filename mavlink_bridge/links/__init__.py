"""Links that transfer datagrams between processes without waiting.

endpoint string → endpoints → opening → a link: udp, tcp, serial_port, replay, or a pair in memory (link).
stream and streams are the base of links over byte streams; demultiplexer divides one link among several.
"""
