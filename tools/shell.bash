# Start file of the interactive `./sunpoint shell`.
sunpoint_path=$PATH
[ -f ~/.bashrc ] && . ~/.bashrc
# The user's start file may have put other Pythons in front.
PATH=$sunpoint_path
unset sunpoint_path
PS1="(sunpoint) $PS1"
echo "Sunpoint shell: ros2 run, ros2 pkg executables, colcon build --symlink-install, python. Leave with exit."
