"""MAVLink wire format: bytes to messages and back, framing, signing, and the payloads of TUNNEL."""
