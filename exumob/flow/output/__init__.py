"""Output of the flow: snapshots of the free surface, pictures, files for ParaView."""
