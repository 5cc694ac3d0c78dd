//! radar/scan to radar/points, and the attitude filter.
