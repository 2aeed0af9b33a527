"""The evaluation report: simulated results, findings, glossary, pages."""
