"""What is shown and stored of a flow: surfaces, pictures, files for ParaView."""
