"""Networks as Modelica models, and Modelica models of plain drive trains as networks."""
