//! What the settings mean: the comments of their fields, kept for programs that show them.

/// Defines a structure of settings and keeps the comments of its fields in `MEANINGS`, by the name of the field.
macro_rules! settings {
    (
        $(#[$about:meta])*
        pub struct $name:ident {
            $($(#[doc = $line:literal])+ pub $field:ident: $kind:ty,)+
        }
    ) => {
        $(#[$about])*
        pub struct $name {
            $($(#[doc = $line])+ pub $field: $kind,)+
        }

        impl $name {
            /// Name and meaning of each setting, in order; units are in the names or the meanings.
            pub const MEANINGS: &[(&str, &str)] = &[$((stringify!($field), concat!($($line),+))),+];
        }
    };
}

pub(crate) use settings;
