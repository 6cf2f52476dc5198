"""truespring compared with other programs: `make bench` runs them and rebuilds docs/performance.md."""
