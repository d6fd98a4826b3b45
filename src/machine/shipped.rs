//! The machines that come with the crate.

/// A list of the files of `machines/` with their texts.
macro_rules! texts {
    ($($name:literal)+) => {
        [$(($name, include_str!(concat!("../../machines/", $name, ".ron")))),+]
    };
}

/// Their names and files, by name.
pub(crate) const SHIPPED: [(&str, &str); 23] = texts! {
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

#[cfg(test)]
mod tests {
    use super::SHIPPED;
    use crate::machine::Machine;

    #[test]
    fn every_machine_of_the_folder_comes_with_the_crate_and_is_named_like_its_file() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/machines");
        let files = std::fs::read_dir(folder).expect("the folder").filter_map(Result::ok);
        let files = files.filter(|file| file.path().extension().is_some_and(|end| end == "ron")).count();
        assert_eq!(SHIPPED.len(), files);
        for (name, text) in SHIPPED {
            assert_eq!(Machine::parse(name, text).expect("a machine").name(), name);
        }
    }
}
