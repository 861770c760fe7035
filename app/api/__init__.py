"""REST under `/api/v1`: thin routes over the store, the jobs and the workflow. Contract: docs/rest.md."""
