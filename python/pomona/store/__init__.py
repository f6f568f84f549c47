"""The border to GeoPackage files of strangers: opened as ours, cell by cell known to be right, or refused."""
