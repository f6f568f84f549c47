"""The orchard in a browser: one page that is told one document, sent by a server or carried inside a report."""
