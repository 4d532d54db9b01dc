// Run the interpreter of a page. It receives the compiled engine and the packed files, and answers calls of `session.py`.
const say = (kind, value) => postMessage([kind, value]);
const bytes = (text) => new TextEncoder().encode(text);
let turn;

onmessage = async ({ data }) => {
  try {
    if (data.start) turn = await start(data.start);
    else say("answer", turn(`session.answer(${JSON.stringify(data.call)})`));
    if (data.start) say("ready");
  } catch (error) {
    say("failed", String(error?.message ?? error));
  }
};

async function start({ base, module, packages, pack }) {
  const { WASI, File, OpenFile, Directory, PreopenDirectory, ConsoleStdout } = await import(`${base}shim/index.js`);

  // book.pack contains the length of its index in eight digits, the index, and the contents of the files.
  const view = new Uint8Array(pack), read = (from, length) => view.subarray(from, from + length);
  const head = Number(new TextDecoder().decode(read(0, 8)));
  const index = JSON.parse(new TextDecoder().decode(read(8, head)));
  const tree = { contents: new Map() };
  for (const [path, [from, length]] of Object.entries(index)) {
    const names = path.split("/"), last = names.pop();
    let folder = tree;
    for (const name of names) {
      if (!folder.contents.has(name)) folder.contents.set(name, new Directory(new Map()));
      folder = folder.contents.get(name);
    }
    folder.contents.set(last, new File(read(8 + head + from, length)));
  }
  const fonts = tree.contents.get("mpl").contents;
  tree.contents.delete("mpl");
  tree.contents.set("tmp", new Directory(new Map()));

  let printed = [];
  const out = () => new ConsoleStdout((part) => printed.push(part.slice()));
  const lib = "/usr/local/lib";
  const wasi = new WASI(
    ["python.wasm"],
    ["HOME=/tmp", "TMPDIR=/tmp", "MPLCONFIGDIR=/tmp", "MPLBACKEND=svg", "PYTHONTZPATH=", "PIDALAB_COMPILE=0", "PYTHON_COLORS=0", "OPENBLAS_NUM_THREADS=1"],
    [
      new OpenFile(new File([])), out(), out(),
      new PreopenDirectory(lib, new Map([["python315.zip", new File(packages)]])),
      // matplotlib looks for its fonts next to its code, but its code is in the zip.
      new PreopenDirectory(`${lib}/python315.zip/matplotlib/mpl-data`, fonts),
      new PreopenDirectory("/", tree.contents),
    ],
    { debug: false },
  );
  // The shim lacks some calls. They return 52 (ENOSYS), which Python accepts.
  const system = {}, refuse = () => 52;
  for (const { module: from, name } of WebAssembly.Module.imports(module)) {
    const call = wasi.wasiImport[name] ?? refuse;
    if (from === "wasi_snapshot_preview1") system[name] = (...given) => call(...given) ?? 0;
  }
  const instance = await WebAssembly.instantiate(module, { wasi_snapshot_preview1: system, host: { call: () => -1 } });
  wasi.inst = instance;
  const { memory, host_alloc, turn, _initialize } = instance.exports;
  _initialize?.();

  function run(code) {
    printed = [];
    const source = bytes(code), place = host_alloc(source.length) >>> 0;
    new Uint8Array(memory.buffer).set(source, place);
    const status = turn(place, source.length);
    const all = new Uint8Array(printed.reduce((sum, part) => sum + part.length, 0));
    printed.reduce((at, part) => (all.set(part, at), at + part.length), 0);
    const text = new TextDecoder().decode(all);
    if (status !== 0) throw new Error(text || `the interpreter returned ${status}`);
    return { text, memory: memory.buffer.byteLength };
  }
  run("import sys; sys.path.insert(0, '/site'); import session; session.install()");
  return run;
}
