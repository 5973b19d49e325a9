"""What is connected to what: netlist, graph, checks, text files."""
