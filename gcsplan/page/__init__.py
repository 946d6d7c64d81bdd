"""`gcsplan map`: a page on which a mission is planned, and the server of this page (extra ``map``)."""
