"""Outputs whose values are bent on their way, and writes by a back door.

Each set was written before anybody looked at what the rules say of it, and then stayed.
"""

from typing import Any

from novel_servers import NUMBER as RAW
from server_edits import FILE
from wrong_servers import temperature

READ = f"value = {RAW}"
SERVE_WRONG: dict[str, Any] = {
    f"written: {name}": temperature(text, *imports)
    for name, text, *imports in [
        ("a print", f"path = {FILE}\nwith open(path, 'w') as file:\n    print(1, file=file)\n{READ}"),
        ("a print into an opened file", f"print(1, file=open({FILE}, 'w'))\n{READ}"),
        ("a print into a path's file", f"print(1, file=({FILE}).open('w'))\n{READ}"),
        ("a tee", f"subprocess.run(['tee', str({FILE})], input='1', text=True)\n{READ}", "subprocess"),
        (
            "a tee that is popped",
            f"tee = subprocess.Popen(['tee', str({FILE})], stdin=-1)\ntee.communicate(b'1')\n{READ}",
            "subprocess",
        ),
        (
            "a tee by its path",
            f"subprocess.check_output(['/usr/bin/tee', str({FILE})], input=b'1')\n{READ}",
            "subprocess",
        ),
        ("a tee of another user", f"subprocess.run(['sudo', 'tee', str({FILE})], input=b'1')\n{READ}", "subprocess"),
        ("a tee in an environment", f"subprocess.run(['env', 'tee', str({FILE})], input=b'1')\n{READ}", "subprocess"),
        ("a tee of a box", f"subprocess.run(['busybox', 'tee', str({FILE})], input=b'1')\n{READ}", "subprocess"),
        (
            "a tee by a name",
            f"command = ['tee', str({FILE})]\nsubprocess.run(command, input=b'1')\n{READ}",
            "subprocess",
        ),
        (
            "an output of a program",
            f"with open({FILE}, 'w') as file:\n    subprocess.run(['echo', '1'], stdout=file)\n{READ}",
            "subprocess",
        ),
        (
            "a descriptor",
            f"number = os.open({FILE}, os.O_WRONLY)\nos.write(number, b'1')\nos.close(number)\n{READ}",
            "os",
        ),
        (
            "a descriptor by a name",
            f"flags = os.O_WRONLY\nnumber = os.open({FILE}, flags)\nos.write(number, b'1')\n{READ}",
            "os",
        ),
        (
            "a descriptor by a number",
            f"number = os.open({FILE}, 1)\nos.write(number, b'1')\nos.close(number)\n{READ}",
            "os",
        ),
        ("a descriptor by a word", f"number = os.open({FILE}, flags=os.O_RDWR)\nos.write(number, b'1')\n{READ}", "os"),
        ("a text of a class", f"Path.write_text({FILE}, '1')\n{READ}"),
        ("a text by a name", f"put = ({FILE}).write_text\nput('1')\n{READ}"),
        ("a text by a map", f"list(map(({FILE}).write_text, ['1']))\n{READ}"),
        ("a text by its attribute", f"getattr({FILE}, 'write_text')('1')\n{READ}"),
        ("bytes of a path", f"({FILE}).write_bytes(b'1')\n{READ}"),
        ("a copy", f"shutil.copy({FILE}, {FILE})\n{READ}", "shutil"),
        ("a second copy", f"shutil.copy2({FILE}, {FILE})\n{READ}", "shutil"),
        ("a copied file", f"shutil.copyfile({FILE}, {FILE})\n{READ}", "shutil"),
        (
            "a copied stream",
            f"with open({FILE}, 'w') as file:\n    shutil.copyfileobj(io.StringIO('1'), file)\n{READ}",
            "shutil",
            "io",
        ),
        ("a raw file", f"with io.FileIO({FILE}, 'w') as file:\n    file.write(b'1')\n{READ}", "io"),
        ("a coded file", f"with codecs.open({FILE}, 'w') as file:\n    file.write('1')\n{READ}", "codecs"),
        ("a log", f"logging.FileHandler({FILE}, 'w')\n{READ}", "logging"),
        ("a copied reference", f"opened = open\nopened({FILE}, 'w').write('1')\n{READ}"),
        ("a part of open", f"functools.partial(open, mode='w')({FILE}).write('1')\n{READ}", "functools"),
        ("a picture", f"import cv2\ncv2.imwrite(str({FILE}), cv2.imread('x'))\n{READ}"),
        ("a length", f"os.truncate({FILE}, 0)\n{READ}", "os"),
        ("a send", f"os.sendfile(os.open({FILE}, os.O_RDWR), 0, 0, 1)\n{READ}", "os"),
    ]
}
SERVE_RIGHT: dict[str, Any] = {
    f"read: {name}": temperature(text, *imports)
    for name, text, *imports in [
        ("an array in memory", f"import numpy\nfile = io.BytesIO()\nnumpy.save(file, numpy.array([1]))\n{READ}", "io"),
        ("open by another name", f"opened = open\nwith opened({FILE}) as file:\n    value = float(file.read())"),
        (
            "a part of open",
            f"read = functools.partial(open, encoding='ascii')\nvalue = float(read({FILE}).read())",
            "functools",
        ),
        (
            "flags by a name",
            f"flags = os.O_RDONLY | os.O_NONBLOCK\nwith runtime.bus(device):\n    number = os.open({FILE}, flags)\n"
            "    value = float(os.read(number, 9))\n    os.close(number)",
            "os",
        ),
        (
            "a program with a time limit",
            f"done = subprocess.run(['timeout', '5', 'cat', str({FILE})], stdout=-1)\nvalue = float(done.stdout)",
            "subprocess",
        ),
        (
            "a program of a box",
            f"value = float(subprocess.run(['busybox', 'cat', str({FILE})], capture_output=True, check=True).stdout)",
            "subprocess",
        ),
        ("a reader by its attribute", f"value = float(getattr({FILE}, 'read_text')())"),
        ("a compressed file", f"import gzip\nvalue = float(gzip.open({FILE}).read())"),
        (
            "a scratch file by a name",
            "with tempfile.TemporaryDirectory() as folder:\n    note = (Path(folder) / 'note').write_text\n"
            f"    note('read')\n{READ}",
            "tempfile",
        ),
        (
            "a coded file that is read",
            f"with codecs.open({FILE}, 'r', 'ascii') as file:\n    value = float(file.read())",
            "codecs",
        ),
        ("a line on standard error", f"import sys\n{READ}\nprint(value, file=sys.stderr)"),
    ]
}
