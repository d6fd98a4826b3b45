//! The machines that come with the crate.

/// A list of the files of `machines/` with their texts.
macro_rules! texts {
    ($($name:literal)+) => {
        [$(($name, include_str!(concat!("../../machines/", $name, ".ron")))),+]
    };
}

/// Their names and files, by name.
pub const SHIPPED: [(&str, &str); 23] = texts! {
    "ac_head_head"
    "ac_table_tilting"
    "ac_table_tilting_paper"
    "bc_head_head"
    "bc_head_head_nutating"
    "bc_head_table"
    "bc_nutating_table"
    "bc_table_tilting"
    "dlr_justin_left"
    "dlr_justin_right"
    "fanuc_r2000ic_165f"
    "four_axis_horizontal"
    "franka_panda"
    "hilti_jaibot"
    "kinova_gen3_lite"
    "kuka_iiwa14"
    "linear_axis"
    "puma560"
    "rotary_axis"
    "scara"
    "six_r_arm"
    "ur10"
    "xyz_mill"
};

/// The file of the one with this name.
#[cfg(feature = "cli")]
pub(crate) fn shipped(name: &str) -> Option<&'static str> {
    SHIPPED.iter().find(|(own, _)| *own == name).map(|(_, text)| *text)
}
