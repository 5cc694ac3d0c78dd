//! Folders of polar images, in the form of the Oxford Radar RobotCar, Boreas, MulRan and RADIATE
//! data sets.

mod image_folder;
mod imu_file;
mod imu_mounting;
mod layout;

pub(crate) use image_folder::ImageFolder;
