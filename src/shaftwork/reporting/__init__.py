"""Reports: a network, its equations and its motion as a document to be signed, in LaTeX, PDF and HTML.

The source of every report is one LaTeX text (`report`), put together from sections (`network_sections`,
`motion_sections`, `vibration_sections`). A TeX system can typeset it. Pandoc makes the page of HTML of it, with its
formulas in MathML, and Typst the PDF, for which no TeX is needed (`writers`).
"""
