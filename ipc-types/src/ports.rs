//! Builders that open each service with its one quality of service.
